//! Fits of one joint to reduced receptances, from many starts, whole in the core.

use crate::error::{Error, Result};
use crate::joint_fit::{Lines, Reduced, SPRING_COLUMNS};
use crate::least_squares::{End, Stop, minimise};
use crate::model::Spring;
use crate::threads::on_threads;

/// Lines that are left of each receptance for the way to the optimum; the end is found on all of them.
const COARSE_LINES: usize = 1500;

/// What a fit takes at least [ns].
const A_FIT: f64 = 100e3;

/// Tolerance on the way.
const COARSE_TOLERANCE: f64 = 1e-4;

/// One receptance of a fit and how its joint depends on the fitted variables.
#[derive(Copy, Clone)]
pub struct Observed<'a> {
    /// The receptance.
    pub reduced: Reduced<'a>,
    /// The seven columns of the joint, where they are not fitted.
    pub joint: [f64; SPRING_COLUMNS],
    /// The variable of each column, if it is fitted.
    pub variables: [Option<usize>; SPRING_COLUMNS],
}

/// The fitted variables.
#[derive(Copy, Clone)]
pub struct Variables<'a> {
    /// Whether a variable is the base-ten logarithm of the value.
    pub logarithmic: &'a [bool],
    /// Lower bounds.
    pub lower: &'a [f64],
    /// Upper bounds.
    pub upper: &'a [f64],
}

/// Fits from each start, `starts` one after the other; the sum of squares over all receptances.
///
/// # Errors
/// Arrays of other lengths than there are variables, or a column of a variable that does not exist.
pub fn fit_joint(
    observed: &[Observed],
    variables: Variables,
    starts: &[f64],
    stop: Stop,
    threads: usize,
) -> Result<Vec<End>> {
    let count = variables.logarithmic.len();
    for (index, length) in [variables.lower.len(), variables.upper.len()].into_iter().enumerate() {
        if length != count {
            let expected = format!("{count} variables");
            return Err(Error::Index {
                what: "bounds of the variables",
                index,
                value: length as f64,
                expected,
            });
        }
    }
    let named = observed.iter().flat_map(|one| one.variables).flatten();
    if let Some(wrong) = named.into_iter().find(|&variable| variable >= count) {
        let expected = format!("a variable below {count}");
        return Err(Error::Index { what: "joint column", index: 0, value: wrong as f64, expected });
    }
    if count == 0 || !starts.len().is_multiple_of(count) {
        let expected = format!("rows of {count} variables");
        return Err(Error::Index { what: "starts", index: 0, value: starts.len() as f64, expected });
    }
    let fewer: Vec<Option<Lines>> = observed.iter().map(|one| coarse(&one.reduced)).collect();
    let few: Option<Vec<Observed>> = fewer
        .iter()
        .any(Option::is_some)
        .then(|| observed.iter().zip(&fewer).map(|(one, fewer)| thinned(one, fewer.as_ref())).collect());
    let rows: Vec<&[f64]> = starts.chunks(count).collect();
    // Many starts share the threads, one start has them for its lines.
    let inside = if rows.len() > 1 { 1 } else { threads };
    on_threads(threads, rows, A_FIT, |start| {
        let mut start = start.to_vec();
        let mut before = 0;
        if let Some(few) = &few {
            let stop = Stop { tolerance: COARSE_TOLERANCE.max(stop.tolerance), ..stop };
            let problem = Problem { observed: few, variables, threads: inside };
            let end = problem.fit(&start, stop);
            before = end.evaluations;
            if end.cost.is_finite() {
                start = end.x;
            }
        }
        let left = Stop { evaluations: stop.evaluations.saturating_sub(before).max(1), ..stop };
        let mut end = Problem { observed, variables, threads: inside }.fit(&start, left);
        end.evaluations += before;
        end
    })
}

/// The sum of squares as a function of the variables.
struct Problem<'a> {
    observed: &'a [Observed<'a>],
    variables: Variables<'a>,
    threads: usize,
}

impl Problem<'_> {
    fn fit(&self, start: &[f64], stop: Stop) -> End {
        let bounds = [self.variables.lower, self.variables.upper];
        minimise(start, bounds, stop, |x| self.normal_matrix(x), |x| self.allows(x))
    }

    /// Value of a variable, and its derivative by the variable.
    fn value(&self, x: &[f64], variable: usize) -> [f64; 2] {
        if !self.variables.logarithmic[variable] {
            return [x[variable], 1.0];
        }
        let value = 10.0_f64.powf(x[variable]);
        [value, value * core::f64::consts::LN_10]
    }

    /// The joint of a receptance; nothing where it is indefinite or holds nothing.
    fn joint(&self, one: &Observed, x: &[f64]) -> Option<[f64; SPRING_COLUMNS]> {
        let mut joint = one.joint;
        for (column, variable) in one.variables.iter().enumerate() {
            if let Some(variable) = *variable {
                joint[column] = self.value(x, variable)[0];
            }
        }
        Spring::new(&joint).check("joint", 0).ok()?;
        Some(joint)
    }

    fn allows(&self, x: &[f64]) -> bool {
        self.observed.iter().all(|one| self.joint(one, x).is_some())
    }

    /// A^T A over all variables and the residual; nothing where a joint is indefinite or holds nothing.
    fn normal_matrix(&self, x: &[f64]) -> Option<Vec<f64>> {
        let size = x.len() + 1;
        let mut sum = vec![0.0; size * size];
        for one in self.observed {
            let joint = self.joint(one, x)?;
            let mut columns = Vec::with_capacity(SPRING_COLUMNS);
            let mut place = Vec::with_capacity(SPRING_COLUMNS + 1);
            for (column, variable) in one.variables.iter().enumerate() {
                if let Some(variable) = *variable {
                    columns.push((column, self.value(x, variable)[1]));
                    place.push(variable);
                }
            }
            place.push(x.len());
            let part = one.reduced.normal_matrix(&joint, &columns, self.threads).ok()?;
            for (i, &row) in place.iter().enumerate() {
                for (j, &column) in place.iter().enumerate() {
                    sum[row * size + column] += part[i * place.len() + j];
                }
            }
        }
        sum.iter().all(|entry| entry.is_finite()).then_some(sum)
    }
}

/// Fewer lines, where there are many.
fn coarse(reduced: &Reduced) -> Option<Lines> {
    let stride = reduced.lines() / COARSE_LINES;
    (stride >= 2).then(|| reduced.thinned(stride))
}

/// The same observation on fewer lines.
fn thinned<'a>(whole: &Observed<'a>, fewer: Option<&'a Lines>) -> Observed<'a> {
    Observed { reduced: fewer.map_or(whole.reduced, |fewer| whole.reduced.of(fewer)), ..*whole }
}
