from .result import Provenance as Provenance
from .result import Renderable as Renderable
from .result import Result as Result
from .result import Results as Results
from .result import versions as versions
from .table import Column as Column
from .table import Fact as Fact
from .table import Table as Table
