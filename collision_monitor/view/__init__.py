"""The view in a browser: what is on the page at a time, where that comes from, and the page.

`picture` is data and needs no browser. Only `page`, `panel` and `server` use viser, which is imported when they are.
"""
