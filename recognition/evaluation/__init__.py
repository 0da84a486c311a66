"""Every method on runs that it was not trained on."""
