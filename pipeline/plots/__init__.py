"""Pictures: parts, fonts, designs and benches; `pictures` holds their style."""
