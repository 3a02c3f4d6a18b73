from . import draft as draft
from . import pieces as pieces

def main() -> None: ...
