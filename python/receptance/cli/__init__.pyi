from . import candidates as candidates
from . import draft as draft
from . import pieces as pieces
from . import story as story
from .__main__ import main as main
