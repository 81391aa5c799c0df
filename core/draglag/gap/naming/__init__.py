"""Name: which effects of the library explain what was found, and second thoughts about them."""
