"""The first page of a site with several scenes: a picture of each, which opens it."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass

from palpate.viewer.gallery_picture import HEIGHT, WIDTH

PICTURES = "pictures"

_PAGE = """<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8" />
    <meta name="viewport" content="width=device-width, initial-scale=1" />
    <link rel="icon" href="favicon.svg" />
    <title>Palpate: soft bodies to touch</title>
    <style>
      :root {{ color-scheme: light dark; font: 100%/1.5 system-ui, sans-serif; }}
      body {{ margin: 0 auto; max-width: 76rem; padding: 2rem 1.25rem 3rem;
        color: light-dark(#241f1c, #f0ece8); background: light-dark(#f1eeea, #171514); }}
      h1 {{ margin: 0; font-size: 1.75rem; }}
      p {{ margin: 0.25rem 0 1.75rem; color: light-dark(#645b54, #b3aaa3); max-width: 44rem; }}
      ul {{ display: grid; gap: 1.25rem; grid-template-columns: repeat(auto-fill, minmax(18rem, 1fr));
        list-style: none; margin: 0; padding: 0; }}
      a {{ display: block; overflow: hidden; border-radius: 0.75rem; text-decoration: none; color: inherit;
        background: light-dark(#fdfcfa, #1f1c1b); border: 1px solid light-dark(#d9d2ca, #3a3532); }}
      a:hover, a:focus-visible {{ border-color: light-dark(#1673b8, #6fc3ff); outline: none; }}
      img {{ display: block; width: 100%; height: auto;
        background: radial-gradient(light-dark(#fffdfa, #6a635c), light-dark(#ddd5cc, #201d1c)); }}
      strong, small {{ display: block; padding: 0 1rem; }}
      strong {{ padding-top: 0.75rem; }}
      small {{ padding-bottom: 0.9rem; color: light-dark(#645b54, #b3aaa3); }}
    </style>
  </head>
  <body>
    <h1>Soft bodies to touch</h1>
    <p>Choose a body, then press on it with the pointer. Your browser computes the forces, 1000 times a second.</p>
    <ul>
{cards}
    </ul>
  </body>
</html>
"""
_CARD = """      <li><a href="{page}?scene={name}">
        <img src="{pictures}/{name}.webp" width="{width}" height="{height}" alt="{title}, pressed by a tool" />
        <strong>{title}</strong><small>{facts}</small></a></li>"""


@dataclass(frozen=True)
class Card:
    """What the page shows of a scene."""

    # In addresses, and for people.
    name: str
    title: str
    nodes: int  # of its finite elements, or of the surface where those are not known
    moves: bool  # whether it has a body in motion
    size: int  # bytes to fetch


def gallery_page(cards: Sequence[Card], page: str) -> str:
    """Return the page; ``page`` opens a scene."""
    return _PAGE.format(cards="\n".join(_card(card, page) for card in cards))


def _card(card: Card, page: str) -> str:
    facts = [f"{card.nodes:,} nodes", *(["in motion"] if card.moves else []), f"{card.size / 1e6:.1f} MB"]
    return _CARD.format(
        page=page,
        name=html.escape(card.name),
        title=html.escape(card.title),
        pictures=PICTURES,
        width=WIDTH,
        height=HEIGHT,
        facts=" · ".join(facts),
    )
