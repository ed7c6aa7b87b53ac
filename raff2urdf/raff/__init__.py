"""The language RAFF: its documents, syntax, reader and writer, and the checks of a document."""
