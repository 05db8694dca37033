"""The browser viewer: one page, one websocket, one port."""
