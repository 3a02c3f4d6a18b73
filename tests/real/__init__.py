"""Effects hidden in measurements of real structures; models of these that an engineer would make.

Only `bridge` imports the library. The measured files are read where they lie, in `../shared/measured` beside the
checkout, and are not part of the project.
"""
