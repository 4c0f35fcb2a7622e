"""Pictures: parts, fonts, designs, benches and the figures of the paper; `pictures` holds their style."""
