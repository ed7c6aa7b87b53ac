"""Commands that write for others: robot controllers, generated code, pages."""
