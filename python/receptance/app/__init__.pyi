from .notebook import NotebookPage as NotebookPage
from .server import page_server as page_server
from .server import serve as serve
