"""From photographs of flat cloth to the fabric that looks like them."""
