"""Files of measurements: FRFs, coherences and time series."""

from receptance.io.errors import FileFormatError
from receptance.io.files import read, read_all, read_frf, read_time_series, write
from receptance.io.measurements import Coherence, TimeSeries

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
