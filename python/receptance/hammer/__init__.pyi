from .estimate import estimate_frf as estimate_frf
from .hits import Hit as Hit
from .hits import Hits as Hits
from .hits import find_hits as find_hits
from .records import HammerRecords as HammerRecords
from .simulate import simulate_hits as simulate_hits
