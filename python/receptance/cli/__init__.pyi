from . import candidates as candidates
from . import story as story
from .__main__ import main as main
