"""Files of measurements: FRFs, coherences and time records, read without guessing and written without loss."""

from receptance.io.coherence import Coherence
from receptance.io.errors import FileFormatError
from receptance.io.reading import read, read_all, read_frf, read_time_series
from receptance.io.time_series import TimeSeries
from receptance.io.writing import write

__all__ = [
    "Coherence",
    "FileFormatError",
    "TimeSeries",
    "read",
    "read_all",
    "read_frf",
    "read_time_series",
    "write",
]
