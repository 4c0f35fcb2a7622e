"""Touch: beam compliance, whiskers, contact, the sensor chain, raster scans and their edge maps."""
