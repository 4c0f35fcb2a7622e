"""Pictures: parts, designs and the figures of the paper."""
