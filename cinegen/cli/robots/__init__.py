"""Commands about robot files: what is in them, closed, healed and checked."""
