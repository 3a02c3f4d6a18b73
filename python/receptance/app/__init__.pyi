from .document import ConflictError as ConflictError
from .document import Document as Document
from .notebook import NotebookPage as NotebookPage
from .server import page_server as page_server
from .server import serve as serve
from .session import Session as Session
from .work import Work as Work
