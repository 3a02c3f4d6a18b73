//! Springs and dashpots of joints and to ground: each column is declared once, with its name and its effect.

use crate::error::{Error, Result};
use num_complex::Complex64;

/// Effect of a column of a spring. The entries of its matrix are 0 for y, 1 for theta and 2 for the coupling.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum Term {
    /// Stiffness of an entry.
    Stiffness(usize),
    /// Viscous damping of an entry.
    Dashpot(usize),
    /// Hysteretic loss factor, with its share in the loss factor of each stiffness.
    Loss([f64; 3]),
}

/// Names and effects of the columns of a spring; stiffnesses are first, then dashpots, then loss factors.
pub const SPRING: &[(&str, Term)] = &[
    ("k_y", Term::Stiffness(0)),
    ("k_theta", Term::Stiffness(1)),
    ("k_ytheta", Term::Stiffness(2)),
    ("c_y", Term::Dashpot(0)),
    ("c_theta", Term::Dashpot(1)),
    ("c_ytheta", Term::Dashpot(2)),
    ("loss_factor", Term::Loss([1.0, 1.0, 1.0])),
];
/// Columns of a spring.
pub const SPRING_COLUMNS: usize = SPRING.len();

/// A spring and dashpot, full, symmetric and complex. For rods k_y and c_y act along the motion and the others are not
/// used.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Spring {
    /// The columns that it was made of, see `SPRING`.
    pub columns: [f64; SPRING_COLUMNS],
    /// k_y, k_theta, k_ytheta.
    pub k: [f64; 3],
    /// c_y, c_theta, c_ytheta.
    pub c: [f64; 3],
    /// Hysteretic loss factors of the stiffnesses.
    pub loss: [f64; 3],
}

impl Spring {
    /// From a row of columns.
    pub fn new(values: &[f64]) -> Self {
        let columns = core::array::from_fn(|column| values[column]);
        let mut out = Self { columns, k: [0.0; 3], c: [0.0; 3], loss: [0.0; 3] };
        for (value, (_, term)) in columns.iter().zip(SPRING) {
            match *term {
                Term::Stiffness(entry) => out.k[entry] = *value,
                Term::Dashpot(entry) => out.c[entry] = *value,
                Term::Loss(shares) => {
                    for (loss, share) in out.loss.iter_mut().zip(shares) {
                        *loss += share * value;
                    }
                }
            }
        }
        out
    }

    /// The columns with some effect, and their values.
    pub(crate) fn columns_with(&self, effect: fn(&Term) -> bool) -> impl Iterator<Item = (usize, f64)> {
        let values = self.columns.into_iter().enumerate();
        values.zip(SPRING).filter(move |(_, (_, term))| effect(term)).map(|(column, _)| column)
    }

    /// The stiffness without dashpots, k (1 + i loss) of each entry.
    // The kernels call it; a call that is not inlined has other instructions.
    #[inline(always)]
    pub fn hysteretic(&self) -> [Complex64; 3] {
        [0, 1, 2].map(|i| Complex64::new(self.k[i], self.k[i] * self.loss[i]))
    }

    /// The dynamic stiffness at an angular frequency: k (1 + i loss) + i w c of each entry.
    #[inline(always)]
    pub fn at(&self, w: Complex64) -> [Complex64; 3] {
        let (k, iw) = (self.hysteretic(), Complex64::I * w);
        [0, 1, 2].map(|i| k[i] + iw * self.c[i])
    }

    /// The same with a share of its dashpots and loss factors.
    pub(crate) fn with_damping(&self, share: f64) -> Self {
        let mut columns = self.columns;
        for (column, value) in self.columns_with(|term| !matches!(term, Term::Stiffness(_))) {
            columns[column] = share * value;
        }
        Self::new(&columns)
    }

    pub(crate) fn check(&self, element: &'static str, row: usize) -> Result<()> {
        let fail = |index: usize, value: f64, expected| {
            Err(Error::Quantity { element, row, quantity: SPRING[index].0, value, expected })
        };
        for (start, values) in [(0, self.k), (3, self.c)] {
            for (i, value) in values.into_iter().enumerate() {
                if !value.is_finite() || (i < 2 && value < 0.0) {
                    let expected = if i < 2 { "zero or a positive finite number" } else { "a finite number" };
                    return fail(start + i, value, expected);
                }
            }
            // A value exactly on the limit is valid in spite of rounding in the product.
            if values[2] * values[2] > values[0] * values[1] * (1.0 + 1e-12) {
                let expected = "at most the root of the product of the other two (positive semidefinite)";
                return fail(start + 2, values[2], expected);
            }
        }
        for (index, value) in self.columns_with(|term| matches!(term, Term::Loss(_))) {
            if !(value.is_finite() && value >= 0.0) {
                return fail(index, value, "zero or a positive finite number");
            }
        }
        Ok(())
    }

    /// Whether the static stiffness alone keeps the interface from being singular.
    pub fn statically_regular(&self, degrees: usize) -> bool {
        let [y, theta, both] = self.k;
        if degrees == 1 { y > 0.0 } else { (both / y) * (both / theta) < 1.0 - 1e-14 }
    }
}
