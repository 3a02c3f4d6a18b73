//! What the tasks of a call write, and the first line that has no value.

use crate::error::{Error, Result};
use crate::frequencies::Frequencies;
use crate::response::LINES_PER_TASK;
use num_complex::Complex64;

/// An error for the first line without a value, given that line of each task that has one.
pub(crate) fn first_of(broken: &[Option<usize>], lines: &Frequencies) -> Result<()> {
    let found =
        broken.iter().enumerate().find_map(|(task, line)| line.map(|line| task * LINES_PER_TASK + line));
    match found {
        Some(line) => {
            let frequency_hz = lines.angular(line).re / core::f64::consts::TAU;
            Err(Error::Resonance { line, frequency_hz })
        }
        None => Ok(()),
    }
}

/// The first line of a task with a value that is not finite, the values of a line standing together.
pub(crate) fn first_broken(outputs: [(&mut [Complex64], usize); 3]) -> Option<usize> {
    let lines = outputs.into_iter().filter_map(|(values, a_line)| {
        values.iter().position(|value| !value.is_finite()).map(|index| index / a_line)
    });
    lines.min()
}

/// The parts of an output that belong to each task, empty ones where there is nothing a line.
pub(crate) fn chunks(values: &mut [Complex64], a_line: usize, lines: usize) -> Vec<&mut [Complex64]> {
    if a_line == 0 {
        return (0..lines.div_ceil(LINES_PER_TASK)).map(|_| Default::default()).collect();
    }
    values.chunks_mut(LINES_PER_TASK * a_line).collect()
}
