"""The executable acceptance suite: campaigns that ship with the product, and the product's own tests."""
