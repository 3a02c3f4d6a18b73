from .document import ConflictError as ConflictError
from .document import Document as Document
from .state import Session as Session
from .work import Work as Work
