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
    /// A row an address: the unknown of b or -1, its multiple or b as a number, a second unknown or -1, its multiple, E, S.
    addresses: Vec<f64>,
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
    /// `(entries and then factors, variables)`.
    pub slopes: Vec<f64>,
}

impl Tied {
    /// Ties the tables to `count` unknowns. `present` are the values of the addresses that are in the tables now.
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
        let known = self.addresses.len() / (BEFORE + 2 * self.count);
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
        let mut by_variable = vec![0.0; self.entries.len() * self.count];
        let width = BEFORE + 2 * self.count;
        let mut by_address = vec![0.0; self.addresses.len() / width * self.count];
        let rows = self.addresses.chunks(width).enumerate();
        let found: Vec<f64> = rows
            .map(|(i, row)| {
                address(row, values, slopes, &mut by_address[i * self.count..(i + 1) * self.count])
            })
            .collect();
        if let Some(index) = found.iter().position(|value| !value.is_finite()) {
            let expected = "a finite number: a law or an error leaves the range of numbers".to_owned();
            return Err(Error::Index { what: "value of address", index, value: found[index], expected });
        }
        let slopes_of = |address: usize| &by_address[address * self.count..(address + 1) * self.count];
        for &(entry, address, rate) in &self.rates {
            let Parameter { table, row, column } = self.entries[entry];
            tables[table as usize][row * table.columns() + column] += rate * found[address];
            let start = entry * self.count;
            for (into, slope) in by_variable[start..start + self.count].iter_mut().zip(slopes_of(address)) {
                *into += rate * slope;
            }
        }
        let mut entries = Vec::with_capacity(self.entries.len());
        let mut moving = Vec::with_capacity(by_variable.len());
        for (entry, slopes) in self.entries.iter().zip(by_variable.chunks(self.count.max(1))) {
            if slopes.iter().any(|slope| *slope != 0.0) {
                entries.push(*entry);
                moving.extend_from_slice(slopes);
            }
        }
        let factors = self.factors.iter().map(|&(factor, address)| (factor, found[address])).collect();
        for (_, address) in &self.factors {
            moving.extend_from_slice(slopes_of(*address));
        }
        let model = Model::new(self.motion, Tables::of(&tables))?;
        Ok(At { model, entries, factors, slopes: moving })
    }
}

/// Columns of an address before E and S.
const BEFORE: usize = 4;

/// Value of an address; its derivatives by the variables go into `by`.
fn address(row: &[f64], values: &[f64], slopes: &[f64], by: &mut [f64]) -> f64 {
    let (exponents, shifts) = row[BEFORE..].split_at(values.len());
    // Few unknowns act on an address.
    let some = |x: &[f64]| x.iter().any(|x| *x != 0.0);
    let dot = |x: &[f64]| {
        if some(x) { x.iter().zip(values).map(|(x, value)| x * value).sum::<f64>() } else { 0.0 }
    };
    let factor = dot(exponents).exp();
    let unknown = |column: usize| (row[column] >= 0.0).then_some((row[column] as usize, row[column + 1]));
    let multiples = [unknown(0), unknown(2)];
    let number = if multiples[0].is_none() { row[1] } else { 0.0 };
    let start =
        number + multiples.iter().flatten().map(|&(own, multiple)| multiple * values[own]).sum::<f64>();
    for (i, by) in by.iter_mut().enumerate() {
        *by = (start * factor * exponents[i] + shifts[i]) * slopes[i];
    }
    for (own, multiple) in multiples.into_iter().flatten() {
        by[own] += multiple * factor * slopes[own];
    }
    start * factor + dot(shifts)
}
