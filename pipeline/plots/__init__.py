"""Pictures: parts, designs and the figures of the paper. One module a picture; `pictures` holds their style."""
