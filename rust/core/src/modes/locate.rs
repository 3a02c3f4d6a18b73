//! Brackets of modes, from counts below some frequencies.
//!
//! Counts put each mode between two frequencies. The determinant of the impedance at the root, which is zero at the
//! mode, refines this: near it this is a fraction of linear functions of w^2, whose pole is where the root would
//! be a node. Next points lie close around that guess, so that counts confirm it, and several modes
//! are narrowed at a time, a lane a point.

use crate::error::{Error, Result};
use crate::simd::lane::MAX_LANES;

/// Relative width at which a bracket is a number.
const WIDTH: f64 = 4e-15;

/// Lowest frequency looked at, as a share of the upper limit.
const LOWEST: f64 = 1e-12;

/// Most modes that are located in one call.
const MOST_MODES: usize = 1_000;

/// Modes that are narrowed at a time.
const AT_ONCE: usize = MAX_LANES / 2;

/// Where the first counts are, as shares of the upper limit.
const FIRST: [f64; MAX_LANES] = [1e-3, 0.01, 0.05, 0.12, 0.25, 0.45, 0.7, 1.0];

/// First points beside where a mode is expected, as shares of that.
const BESIDE: f64 = 0.03;

/// By how much the upper limit grows when there are too few modes below it.
const GROWTH: f64 = 1.5;

/// Distances from a guess, as shares of how far off it may be.
const DISTANCES: [f64; 4] = [1.0, 0.01, 0.1, 0.001];

/// A guess from one side alone may be off by this share of its bracket.
const ONE_SIDED: f64 = 0.03;

/// A guess whose points narrow the bracket to no less than this share is followed by a plain division.
const SLOW: f64 = 0.25;

/// Requested modes.
#[derive(Copy, Clone)]
pub(crate) enum Wanted<'a> {
    /// Those below the upper limit, at most so many.
    UpTo(usize),
    /// These, counted from 0 on; the upper limit grows as far as they need it.
    These {
        /// Ascending.
        modes: &'a [usize],
        /// Where they are expected.
        near: &'a [f64],
        /// How far the limit may grow.
        farthest: f64,
    },
}

/// Results at one frequency.
#[derive(Copy, Clone)]
struct Sample {
    w: f64,
    /// Modes below it, rigid-body modes included.
    count: usize,
    /// The determinant of the impedance at the root.
    determinant: f64,
}

/// A mode that is looked for.
struct Sought {
    /// Counted from 1 on, rigid-body modes included.
    mode: usize,
    found: Option<f64>,
    /// Width of its bracket when points were put there, and whether these were around a guess.
    width: f64,
    guessed: bool,
}

/// Where a mode is expected, and how far off that may be.
struct Guess {
    w: f64,
    error: f64,
}

/// The search for modes: the next frequencies, and the results there.
pub(crate) struct Locating<'a> {
    wanted: Wanted<'a>,
    rigid: usize,
    upper: f64,
    /// Ascending.
    samples: Vec<Sample>,
    sought: Option<Vec<Sought>>,
    points: Vec<f64>,
}

impl<'a> Locating<'a> {
    /// The search for modes up to `upper` of a structure with `rigid` rigid-body modes.
    pub fn new(wanted: Wanted<'a>, upper: f64, rigid: usize) -> Self {
        let mut points: Vec<f64> = FIRST.iter().map(|share| share * upper).collect();
        if let Wanted::These { near, .. } = wanted {
            points.truncate(1);
            points.extend(near.iter().flat_map(|w| [w * (1.0 - BESIDE), w * (1.0 + BESIDE)]));
            points.extend([upper, GROWTH * upper]);
            points.sort_by(f64::total_cmp);
        }
        Self { wanted, rigid, upper, samples: Vec::with_capacity(32), sought: None, points }
    }

    /// Frequencies at which modes are to be counted next, ascending; none at the end.
    pub fn points(&self) -> &[f64] {
        &self.points
    }

    /// The modes that were found.
    pub fn found(&self) -> Vec<f64> {
        self.sought.iter().flatten().filter_map(|one| one.found).collect()
    }

    /// Takes counts and determinants at the points, and returns the next points.
    pub fn see(&mut self, seen: &[(usize, f64)]) -> Result<()> {
        for (w, (count, determinant)) in core::mem::take(&mut self.points).into_iter().zip(seen) {
            let at = self.samples.partition_point(|sample| sample.w < w);
            // Rounding at the mode itself may disturb the order by one.
            let least = if at > 0 { self.samples[at - 1].count } else { 0 };
            let most = self.samples.get(at).map_or(usize::MAX, |sample| sample.count);
            let count = (*count).clamp(least, most.max(least));
            self.samples.insert(at, Sample { w, count, determinant: *determinant });
        }
        if self.sought.is_none() && !self.surrounded()? {
            return Ok(());
        }
        self.narrow();
        Ok(())
    }

    /// Whether counts enclose all requested modes; else the next points are farther out.
    fn surrounded(&mut self) -> Result<bool> {
        let (first, last) = (self.samples[0], self.samples[self.samples.len() - 1]);
        if first.count > self.rigid {
            let lower = 1e-3 * first.w;
            if lower < LOWEST * self.upper {
                return Err(Error::NaturalFrequency(format!(
                    "there are modes below {:e} Hz that are not rigid-body modes",
                    lower / core::f64::consts::TAU
                )));
            }
            self.points.push(lower);
            return Ok(false);
        }
        for sample in &mut self.samples {
            sample.count = sample.count.max(self.rigid);
        }
        let beyond = last.count.max(self.rigid) - self.rigid;
        let modes: Vec<usize> = match self.wanted {
            Wanted::UpTo(most) => (0..beyond.min(most)).collect(),
            Wanted::These { modes, farthest, .. } => {
                let enough = modes.last().is_none_or(|&mode| mode < beyond);
                if !enough && last.w < farthest {
                    self.points.extend((1..5).map(|i| last.w * GROWTH.powi(i)));
                    return Ok(false);
                }
                if enough { modes.to_vec() } else { Vec::new() }
            }
        };
        if modes.len() > MOST_MODES {
            return Err(too_high(self.upper, &format!("there are {beyond} modes below it")));
        }
        let sought = modes.into_iter().map(|mode| Sought {
            mode: self.rigid + mode + 1,
            found: None,
            width: f64::INFINITY,
            guessed: false,
        });
        self.sought = Some(sought.collect());
        Ok(true)
    }

    /// Ends the search for modes that are known to the last digits, and puts points in the brackets of others.
    fn narrow(&mut self) {
        let mut sought = self.sought.take().unwrap_or_default();
        let mut open: Vec<(usize, usize, Option<Guess>)> = Vec::with_capacity(AT_ONCE);
        for (index, one) in sought.iter_mut().enumerate().filter(|(_, one)| one.found.is_none()) {
            let most = self.samples.len() - 1;
            let above = self.samples.partition_point(|sample| sample.count < one.mode).clamp(1, most);
            if open.last().is_some_and(|last| last.1 == above) {
                continue;
            }
            let (low, high) = (self.samples[above - 1], self.samples[above]);
            let width = high.w - low.w;
            let guess = if high.count - low.count == 1 { self.guess(above) } else { None };
            one.found = match &guess {
                _ if width <= WIDTH * high.w => Some(0.5 * (low.w + high.w)),
                Some(guess) if guess.error <= WIDTH * guess.w => Some(guess.w),
                _ => None,
            };
            if one.found.is_some() {
                continue;
            }
            let slow = one.guessed && width > SLOW * one.width;
            let guess = guess.filter(|_| !slow);
            (one.width, one.guessed) = (width, guess.is_some());
            open.push((index, above, guess));
            if open.len() == AT_ONCE {
                break;
            }
        }
        for (index, above, guess) in &open {
            let (low, high) = (self.samples[above - 1].w, self.samples[*above].w);
            let before = self.points.len();
            divide(low, high, guess.as_ref(), MAX_LANES / open.len(), &mut self.points);
            if self.points.len() == before {
                sought[*index].found = Some(0.5 * (low + high));
            }
        }
        let all_at_end = self.points.is_empty() && !open.is_empty();
        self.sought = Some(sought);
        if all_at_end {
            self.narrow();
        }
    }

    /// Where between the samples below and at `above` the determinant is zero.
    fn guess(&self, above: usize) -> Option<Guess> {
        let (low, high) = (self.samples[above - 1], self.samples[above]);
        let near = if low.determinant.abs() < high.determinant.abs() { low } else { high };
        let far = if low.determinant.abs() < high.determinant.abs() { high } else { low };
        let below = above.checked_sub(2).and_then(|third| self.samples.get(third));
        let mut guesses = [below, self.samples.get(above + 1)].map(|third| {
            third.and_then(|third| zero(&near, &far, third)).filter(|w| low.w < *w && *w < high.w)
        });
        guesses.sort_by_key(Option::is_none);
        match guesses {
            [Some(first), Some(second)] => {
                Some(Guess { w: 0.5 * (first + second), error: (first - second).abs() })
            }
            [Some(w), _] => Some(Guess { w, error: ONE_SIDED * (high.w - low.w) }),
            _ => None,
        }
    }
}

/// The zero of the fraction of linear functions of w^2 that three samples determine.
fn zero(near: &Sample, far: &Sample, third: &Sample) -> Option<f64> {
    let steepness =
        |other: &Sample| (other.determinant - near.determinant) / ((other.w - near.w) * (other.w + near.w));
    let (first, second) = (steepness(far), steepness(third));
    let bend = far.determinant * (first - second) / (third.determinant - far.determinant);
    let step = -near.determinant / (first + bend);
    let w = near.w + step / (near.w + (near.w * near.w + step).sqrt());
    w.is_finite().then_some(w)
}

/// Up to `count` points within a bracket, ascending: around a guess, or all along.
fn divide(low: f64, high: f64, guess: Option<&Guess>, count: usize, points: &mut Vec<f64>) {
    let before = points.len();
    match guess {
        Some(Guess { w, error }) => {
            let reach = error.max(0.5 * WIDTH * w);
            let distances = DISTANCES.map(|share| (share * reach).max(0.4 * WIDTH * w));
            // The one distance that there is room for should enclose the mode, and not by far.
            let few = [0.1 * reach];
            let chosen = if count < 4 { &few[..] } else { &distances[..count / 2] };
            points.extend(chosen.iter().flat_map(|distance| [w - distance, w + distance]));
        }
        None => {
            let ratio = high / low;
            points.extend((1..=count).map(|i| {
                let share = i as f64 / (count + 1) as f64;
                if ratio > 2.0 { low * ratio.powf(share) } else { low + share * (high - low) }
            }));
        }
    }
    points[before..].sort_by(f64::total_cmp);
    let mut last = low;
    let mut at = before;
    for i in before..points.len() {
        if points[i] > last && points[i] < high {
            last = points[i];
            points[at] = last;
            at += 1;
        }
    }
    points.truncate(at);
}

/// The error of an upper limit that is too high.
pub(crate) fn too_high(upper: f64, reason: &str) -> Error {
    let hz = upper / core::f64::consts::TAU;
    Error::NaturalFrequency(format!("the upper limit of {hz:.6e} Hz is too high: {reason}"))
}
