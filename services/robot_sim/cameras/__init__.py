"""The cameras: their own process, so that rendering never stalls control. They know only what is published."""
