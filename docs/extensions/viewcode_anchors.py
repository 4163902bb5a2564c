"""Anchors for the links that lead back from the code.

`sphinx.ext.viewcode` takes one name of the module for all objects of a file. Objects that are
documented under another, shorter or longer, get the anchors for both.
"""

from importlib import import_module

from sphinx.addnodes import desc_signature


def _add_anchors(app, doctree):
    for signature in doctree.findall(desc_signature):
        module, name = signature.get("module"), signature.get("fullname")
        if not module:
            continue
        found = getattr(import_module(module), name.partition(".")[0])
        for home in (getattr(found, "__module__", module), "cdcp_igl"):
            if f"{home}.{name}" not in signature["ids"]:
                signature["ids"].append(f"{home}.{name}")


def setup(app):
    app.connect("doctree-read", _add_anchors)
    return {"parallel_read_safe": False}
