//! Errors of a model or a request; each variant names the quantity and its value.

/// Errors of the core.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A number that has no physical meaning where it stands.
    #[error("{element} {row}: {quantity} is {value}, expected {expected}")]
    Quantity {
        /// Kind of element, "segment", "joint", "point mass", "ground spring".
        element: &'static str,
        /// Row of the element in its table.
        row: usize,
        /// Name of the quantity.
        quantity: &'static str,
        /// The value found.
        value: f64,
        /// The expected value.
        expected: &'static str,
    },
    /// A frequency line that cannot be used.
    #[error("frequency line {line}: angular frequency is {re}{im:+}i rad/s, expected {expected}")]
    Frequency {
        /// Index of the line.
        line: usize,
        /// Real part found.
        re: f64,
        /// Imaginary part found.
        im: f64,
        /// The expected value.
        expected: &'static str,
    },
    /// A segment that is extremely long for the waves at a frequency.
    #[error(
        "segment {row}: at {frequency_hz} Hz its length is {waves:.3e} wavelengths, expected at most {most:.1e}; \
         check units of frequency, length and modulus"
    )]
    Waves {
        /// Row of the segment.
        row: usize,
        /// Frequency in Hz.
        frequency_hz: f64,
        /// Wavelengths in it.
        waves: f64,
        /// Most that are allowed.
        most: f64,
    },
    /// An overlap that is extremely long for its beams and its layer at a frequency.
    #[error(
        "overlap {row}: at {frequency_hz} Hz motion grows by {exponent:.3e} exponents over its length, expected at \
         most {most:.1e}; check units, and give so stiff a layer as a bonded section (a core in a bore)"
    )]
    Layer {
        /// Row of the overlap.
        row: usize,
        /// Frequency in Hz.
        frequency_hz: f64,
        /// Growth exponents over its length.
        exponent: f64,
        /// Most that are allowed.
        most: f64,
    },
    /// Elements that do not join to a tree of nodes.
    #[error("the elements do not form one tree of nodes: {0}")]
    Topology(String),
    /// An excitation, response or parameter that the model does not have.
    #[error("{what} {index} is {value}, expected {expected}")]
    Index {
        /// "excitation", "response", "parameter table", "parameter row", "parameter column".
        what: &'static str,
        /// Position in the list.
        index: usize,
        /// The value found.
        value: f64,
        /// The expected value.
        expected: String,
    },
    /// An interface whose stiffness matrix cannot be inverted.
    #[error(
        "{element} {row}: the interface is singular at {frequency_hz} Hz (k_y {k_y}, k_theta {k_theta}, \
         k_ytheta {k_ytheta}): every direction needs some stiffness or damping"
    )]
    SingularInterface {
        /// "joint" or "overlap".
        element: &'static str,
        /// Its row.
        row: usize,
        /// Frequency in Hz.
        frequency_hz: f64,
        /// Dynamic stiffness of the translation, real part.
        k_y: f64,
        /// Of the rotation.
        k_theta: f64,
        /// Of the coupling.
        k_ytheta: f64,
    },
    /// A response that is not finite: an undamped resonance met exactly.
    #[error(
        "the receptance is not finite at {frequency_hz} Hz (line {line}): an undamped resonance met exactly"
    )]
    Resonance {
        /// Index of the line.
        line: usize,
        /// Frequency in Hz.
        frequency_hz: f64,
    },
    /// A joint in micro-slip of which the whole interface slides, or without a level.
    #[error("joint {row} {}", gross_slip(direction, *frequency_hz, *force, *most))]
    GrossSlip {
        /// Row of the joint.
        row: usize,
        /// "y" or "theta".
        direction: &'static str,
        /// Frequency in Hz.
        frequency_hz: f64,
        /// Amplitude of the force in N.
        force: f64,
        /// The most of the stiffness that may be lost, if more would be.
        most: Option<f64>,
    },
    /// Natural frequencies that cannot be separated or counted.
    #[error("natural frequencies: {0}")]
    NaturalFrequency(String),
    /// A mode that cannot be followed from an undamped one.
    #[error("complex natural frequencies: {0}")]
    ComplexFrequency(String),
    /// A point at which residuals that the caller computes do not exist.
    #[error("the given function has no value there")]
    NoValue,
    /// The caller ended the call.
    #[error("interrupted")]
    Interrupted,
    /// The threads of a pool could not be started.
    #[error("could not start {threads} threads: {reason}")]
    Threads {
        /// Requested threads.
        threads: usize,
        /// Message of the system.
        reason: String,
    },
}

fn gross_slip(direction: &str, frequency_hz: f64, force: f64, most: Option<f64>) -> String {
    let under = format!("at {frequency_hz} Hz under {force} N");
    match most {
        Some(most) => format!(
            "slides as a whole in {direction} {under}: more than {most:.3} of the stiffness would be lost"
        ),
        None => format!("has no level {under} that the force and its motion agree on"),
    }
}

/// Result of the core.
pub type Result<T> = core::result::Result<T, Error>;

/// Checks the length of an array.
///
/// # Errors
/// Another one than expected.
pub(crate) fn same_length(what: &'static str, index: usize, length: usize, expected: usize) -> Result<()> {
    if length == expected {
        return Ok(());
    }
    Err(Error::Index { what, index, value: length as f64, expected: format!("{expected} values") })
}

/// Checks that there are a measured value and a weight for each line.
///
/// # Errors
/// More or fewer of either.
pub(crate) fn one_a_line(measured: usize, weights: usize, lines: usize) -> Result<()> {
    same_length("measured receptance", 0, measured, lines)?;
    same_length("weights", 0, weights, lines)
}

/// A result that is nothing where a model has no value.
///
/// # Errors
/// An error of the machine instead of the model: no threads, or a call that its caller ended.
pub(crate) fn if_any<T>(result: Result<T>) -> Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error @ (Error::Threads { .. } | Error::Interrupted)) => Err(error),
        Err(_) => Ok(None),
    }
}
