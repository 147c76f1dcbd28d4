"""Reports: results become one content tree, and the tree becomes text, HTML or JSON.

Nothing is computed here. `content` holds the tree; `text`, `html` and `json` each draw all of
it, so the three cannot disagree.
"""
