"""The documentation as a site: pages generated from the code, and everything built into `site/`."""
