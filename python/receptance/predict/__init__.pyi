from .candidate import Candidate as Candidate
from .ranking import Expectation as Expectation
from .ranking import NextMeasurement as NextMeasurement
from .ranking import RankedCandidate as RankedCandidate
from .ranking import next_measurement as next_measurement
from .transfers import Split as Split
from .transfers import Transfer as Transfer
from .transfers import transfer as transfer
