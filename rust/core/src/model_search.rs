//! Fits of whole models from many starts in one call.

use crate::error::{Error, Result};
use crate::least_squares::{End, Stop, minimise};
use crate::model_fit::Campaign;
use crate::threads::on_threads;

/// What a fit takes at least [ns]: helpers are worth waking for each.
const A_FIT: f64 = 1e6;

/// Fits from each start, `starts` one after the other, with variables that are not `free` held where they start.
///
/// The normal matrices of the ends are over the free variables and the residual.
///
/// # Errors
/// Arrays that do not belong together.
pub fn fit_models(
    campaign: &Campaign,
    free: &[bool],
    starts: &[f64],
    stop: Stop,
    threads: usize,
) -> Result<Vec<End>> {
    campaign.check()?;
    let count = campaign.variables.logarithmic.len();
    if count == 0 || !starts.len().is_multiple_of(count) || free.len() != count {
        let expected = format!("rows of {count} variables");
        return Err(Error::Index { what: "starts", index: 0, value: starts.len() as f64, expected });
    }
    let moving: Vec<usize> = (0..count).filter(|&i| free[i]).collect();
    let pick = |values: &[f64]| -> Vec<f64> { moving.iter().map(|&i| values[i]).collect() };
    let (lower, upper) = (pick(campaign.variables.lower), pick(campaign.variables.upper));
    let rows: Vec<&[f64]> = starts.chunks(count).collect();
    // Many starts share the threads, one start has them for its lines.
    let inside = if rows.len() > 1 { 1 } else { threads };
    on_threads(threads, rows, A_FIT, |start| {
        let whole = |x: &[f64]| {
            let mut whole = start.to_vec();
            for (&i, value) in moving.iter().zip(x) {
                whole[i] = *value;
            }
            whole
        };
        let normal = |x: &[f64]| {
            let matrix = campaign.normal_matrix(&whole(x), free, inside)?;
            let kept = || moving.iter().copied().chain([count]);
            Some(kept().flat_map(|i| kept().map(move |j| i * (count + 1) + j)).map(|at| matrix[at]).collect())
        };
        let allowed = |x: &[f64]| campaign.allows(&whole(x));
        let end = minimise(&pick(start), [&lower, &upper], stop, normal, allowed);
        End { x: whole(&end.x), ..end }
    })
}
