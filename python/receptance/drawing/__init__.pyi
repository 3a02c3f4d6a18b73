from .read import TIPS as TIPS
from .read import DrawingOptions as DrawingOptions
from .read import DrawnContour as DrawnContour
from .read import DrawnOutline as DrawnOutline
from .read import Tip as Tip
from .read import outline as outline
from .read import read_contour as read_contour
from .report import ContourReport as ContourReport
