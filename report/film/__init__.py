"""The impact in motion: what the page's three-dimensional view draws, read from view.pvd and packed into the page."""
