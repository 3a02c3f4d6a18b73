from . import candidates as candidates
from . import draft as draft
from . import pieces as pieces
from . import story as story

def main() -> None: ...
