//! From the fitted variables to the tables of a model, with derivatives.
//!
//! The values u of the unknowns are the variables or ten to their power. An address of a model has the value
//! v = b exp(E u) + S u, b a number or a sum of multiples of one or two unknowns (laws, tolerances), and an entry of a
//! table grows with the addresses at fixed rates. Addresses may also be factors of the record, see `observed`.

use crate::error::{Error, Result};
use crate::model::assembly::{Model, TABLES, Table, Tables};
use crate::model::request::Parameter;
use crate::model::section::Motion;
use crate::model::terminals::TERMINAL_COLUMNS;
use core::ops::{Add, Mul};

/// Parameters of the measuring chain between a structure and its record.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum Factor {
    /// Natural logarithm of a gain.
    LogGain,
    /// Time in s by which the response lags behind.
    Delay,
    /// Rate in 1/s of an exponential window, and how many times the record is integrated.
    DecayRate(i32),
    /// Time in s after the hit at which the record ended.
    End,
    /// By how many Hz the stated lines are too high, and how many times the record is integrated.
    Offset(i32),
    /// Exponent of the frequency in the level.
    LevelExponent,
    /// Slope in s of the logarithm of the level over the angular frequency.
    LevelSlope,
    /// Angle in rad by which the response leads.
    Phase,
    /// Time constant in s of a low pass of first order in the channel of the response; negative in that of the force.
    LowPass,
    /// Corner in rad/s of a high pass of first order in the channel of the response; negative in that of the force.
    HighPass,
}

/// How fast an entry of a table grows with an address.
#[derive(Copy, Clone, Debug)]
pub struct Rate {
    /// The entry.
    pub entry: Parameter,
    /// The address.
    pub address: usize,
    /// Its rate.
    pub rate: f64,
}

/// The tables of one model as functions of the unknowns.
#[derive(Clone, Debug)]
pub struct Tied {
    /// The tables less the contribution of the addresses.
    fixed: [Vec<f64>; TABLES],
    motion: Motion,
    /// The distinct entries that move.
    pub entries: Vec<Parameter>,
    /// Entry, address and rate.
    rates: Vec<(usize, usize, f64)>,
    addresses: Vec<Address>,
    count: usize,
    /// Factors of the record, and their addresses.
    factors: Vec<(Factor, usize)>,
}

/// Tables of a model and the derivatives of their moving entries by the variables, row by row.
pub struct At {
    /// The model.
    pub model: Model,
    /// Those entries that the variables move.
    pub entries: Vec<Parameter>,
    /// Factors of the record.
    pub factors: Vec<(Factor, f64)>,
    /// Derivatives of the entries and then of the factors by the variables that move them.
    slopes: Vec<Slopes>,
}

/// Derivatives by some variables, each with its number.
type Slopes = Vec<(usize, f64)>;

/// How a variable moves a model.
pub(crate) struct Column {
    /// Its place among the variables.
    pub place: usize,
    /// The entries and factors that it moves, and their derivatives by it.
    pub slopes: Slopes,
}

impl Column {
    /// The derivative by the variable of a quantity with some derivatives by the entries and factors.
    pub fn combine<T: Copy + Default + Mul<f64, Output = T> + Add<Output = T>>(&self, by: &[T]) -> T {
        self.slopes.iter().fold(T::default(), |sum, &(entry, slope)| sum + by[entry] * slope)
    }
}

impl At {
    /// The variables that move the model, of some of them with so many altogether.
    pub(crate) fn columns(&self, among: &[usize], count: usize) -> Vec<Column> {
        let mut by_variable = vec![Slopes::new(); count];
        for (entry, slopes) in self.slopes.iter().enumerate() {
            for &(variable, slope) in slopes.iter().filter(|(_, slope)| *slope != 0.0) {
                by_variable[variable].push((entry, slope));
            }
        }
        let column = |(place, &variable): (usize, &usize)| {
            let slopes = core::mem::take(&mut by_variable[variable]);
            (!slopes.is_empty()).then_some(Column { place, slopes })
        };
        among.iter().enumerate().filter_map(column).collect()
    }
}

impl Tied {
    /// Ties the tables to `count` unknowns. `present` are the values of the addresses that are in the tables now, and
    /// `addresses` has a row for each: the unknown of b or -1, its multiple or b as a number, a second unknown or -1, its
    /// multiple, E, S.
    ///
    /// # Errors
    /// An entry, an address or an unknown that does not exist.
    pub fn new(
        motion: Motion,
        tables: Tables,
        rates: &[Rate],
        present: &[f64],
        addresses: Vec<f64>,
        count: usize,
    ) -> Result<Self> {
        let width = BEFORE + 2 * count;
        let expected = || format!("rows of {width} columns for {count} unknowns");
        if !addresses.len().is_multiple_of(width) {
            let value = addresses.len() as f64;
            return Err(Error::Index { what: "addresses", index: 0, value, expected: expected() });
        }
        for (index, row) in addresses.chunks(width).enumerate() {
            if let Some(&value) =
                [row[0], row[2]].iter().find(|value| value.is_nan() || **value >= count as f64)
            {
                let expected = format!("an unknown below {count}, or -1");
                return Err(Error::Index { what: "address", index, value, expected });
            }
        }
        let known = addresses.len() / width;
        if present.len() != known {
            let (value, expected) = (present.len() as f64, format!("{known}, one of each address"));
            return Err(Error::Index { what: "number of present values", index: 0, value, expected });
        }
        let fixed = tables.each().map(<[f64]>::to_vec);
        let (entries, rated, factors) = (Vec::new(), Vec::new(), Vec::new());
        let addresses = addresses.chunks(width).map(Address::new).collect();
        let mut tied = Self { fixed, motion, entries, rates: rated, addresses, count, factors };
        for (index, rate) in rates.iter().enumerate() {
            if rate.address >= known {
                let expected = format!("an address below {known}");
                return Err(Error::Index { what: "rate", index, value: rate.address as f64, expected });
            }
            tied.check_entry(index, rate.entry)?;
            let Parameter { table, row, column } = rate.entry;
            tied.fixed[table as usize][row * table.columns() + column] -= rate.rate * present[rate.address];
            let known = tied.entries.iter().position(|entry| *entry == rate.entry);
            let entry = known.unwrap_or_else(|| {
                tied.entries.push(rate.entry);
                tied.entries.len() - 1
            });
            tied.rates.push((entry, rate.address, rate.rate));
        }
        Ok(tied)
    }

    /// Number of unknowns.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of terminals.
    pub fn terminals(&self) -> usize {
        self.fixed[Table::Terminals as usize].len() / TERMINAL_COLUMNS
    }

    /// The same with factors at addresses.
    ///
    /// # Errors
    /// An address that does not exist.
    pub fn with_factors(mut self, factors: Vec<(Factor, usize)>) -> Result<Self> {
        let known = self.addresses.len();
        if let Some((index, wrong)) = factors.iter().enumerate().find(|(_, factor)| factor.1 >= known) {
            let expected = format!("an address below {known}");
            return Err(Error::Index { what: "factor", index, value: wrong.1 as f64, expected });
        }
        self.factors = factors;
        Ok(self)
    }

    fn check_entry(&self, index: usize, Parameter { table, row, column }: Parameter) -> Result<()> {
        if column < table.columns() && (row + 1) * table.columns() <= self.fixed[table as usize].len() {
            return Ok(());
        }
        let expected = "a row and a column of its table".to_owned();
        Err(Error::Index { what: "entry", index, value: row as f64, expected })
    }

    /// The model at a point. `slopes` are the derivatives of the values by the variables, zero for those that are held.
    ///
    /// # Errors
    /// Values that make no model.
    pub fn at(&self, values: &[f64], slopes: &[f64]) -> Result<At> {
        let mut tables = self.fixed.clone();
        let found: Vec<(f64, Slopes)> = self.addresses.iter().map(|one| one.at(values, slopes)).collect();
        if let Some((index, (value, _))) = found.iter().enumerate().find(|(_, (value, _))| !value.is_finite())
        {
            let expected = "a finite number: a law or an error leaves the range of numbers".to_owned();
            return Err(Error::Index { what: "value of address", index, value: *value, expected });
        }
        let mut moved = vec![Slopes::new(); self.entries.len()];
        for &(entry, address, rate) in &self.rates {
            let Parameter { table, row, column } = self.entries[entry];
            let (value, slopes) = &found[address];
            tables[table as usize][row * table.columns() + column] += rate * value;
            for &(variable, slope) in slopes {
                add(&mut moved[entry], variable, rate * slope);
            }
        }
        let (mut entries, mut slopes) = (Vec::new(), Vec::new());
        for (entry, own) in self.entries.iter().zip(moved) {
            if own.iter().any(|(_, slope)| *slope != 0.0) {
                entries.push(*entry);
                slopes.push(own);
            }
        }
        let factors = self.factors.iter().map(|&(factor, address)| (factor, found[address].0)).collect();
        slopes.extend(self.factors.iter().map(|&(_, address)| found[address].1.clone()));
        let model = Model::new(self.motion, Tables::of(&tables))?;
        Ok(At { model, entries, factors, slopes })
    }
}

/// Columns of an address before E and S.
const BEFORE: usize = 4;

/// The value b exp(E u) + S u of an address, with the unknowns that act on it.
#[derive(Clone, Debug)]
struct Address {
    /// b without unknowns.
    number: f64,
    /// The unknowns of b with their multiples.
    multiples: Slopes,
    exponents: Slopes,
    shifts: Slopes,
}

impl Address {
    /// From a row of `Tied::new`.
    fn new(row: &[f64]) -> Self {
        let (before, matrices) = row.split_at(BEFORE);
        let (exponents, shifts) = matrices.split_at(matrices.len() / 2);
        // Few unknowns act on an address.
        let some = |row: &[f64]| row.iter().copied().enumerate().filter(|(_, value)| *value != 0.0).collect();
        let based = before.chunks_exact(2).filter(|pair| pair[0] >= 0.0);
        Self {
            number: if before[0] < 0.0 { before[1] } else { 0.0 },
            multiples: based.map(|pair| (pair[0] as usize, pair[1])).collect(),
            exponents: some(exponents),
            shifts: some(shifts),
        }
    }

    /// Its value and its derivatives by the variables, of which the values of the unknowns have the derivatives `slopes`.
    fn at(&self, values: &[f64], slopes: &[f64]) -> (f64, Slopes) {
        let dot = |of: &Slopes| of.iter().map(|&(own, by)| by * values[own]).sum::<f64>();
        let (start, factor) = (self.number + dot(&self.multiples), dot(&self.exponents).exp());
        let mut by = Slopes::with_capacity(self.multiples.len() + self.exponents.len() + self.shifts.len());
        for (of, factor) in
            [(&self.exponents, start * factor), (&self.shifts, 1.0), (&self.multiples, factor)]
        {
            for &(own, value) in of {
                add(&mut by, own, factor * value * slopes[own]);
            }
        }
        (start * factor + dot(&self.shifts), by)
    }
}

/// Adds a derivative by a variable.
fn add(to: &mut Slopes, variable: usize, slope: f64) {
    match to.iter_mut().find(|(own, _)| *own == variable) {
        Some((_, sum)) => *sum += slope,
        None => to.push((variable, slope)),
    }
}
