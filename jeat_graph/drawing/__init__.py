"""Everything that is drawn: pictures of a run, films, plots of comparisons, and the HTML page."""
