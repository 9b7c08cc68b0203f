"""From lobes to the thread that scatters like them."""
