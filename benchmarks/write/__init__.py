"""Views of what was measured: Markdown, HTML, the README, figures."""
