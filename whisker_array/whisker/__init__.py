"""The whisker: its shape, sections, compliance, enhancement factor and limits of validity, and arrays of it."""
