"""CSV: tables with a header that names quantity and unit of each column."""
