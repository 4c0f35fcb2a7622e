"""What several experts believe, made one."""
