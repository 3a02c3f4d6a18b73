from .errors import FileFormatError as FileFormatError
from .files import read as read
from .files import read_all as read_all
from .files import read_frf as read_frf
from .files import read_time_series as read_time_series
from .files import write as write
from .measurements import Coherence as Coherence
from .measurements import TimeSeries as TimeSeries
