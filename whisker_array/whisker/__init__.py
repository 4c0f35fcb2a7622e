"""The whisker: shape, sections, compliance, enhancement factor and limits of validity; arrays of whiskers."""
