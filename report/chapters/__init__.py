"""The chapters of the report: which figures they hold, and how each is drawn from the results of a sweep."""
