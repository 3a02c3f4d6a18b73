from .catalogue import EXAMPLES as EXAMPLES
from .catalogue import Example as Example
from .catalogue import write as write
