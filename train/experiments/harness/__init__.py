"""What experiments share: the laboratory, results that are kept, tables, figures, the page."""
