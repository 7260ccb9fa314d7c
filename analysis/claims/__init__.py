"""The paper's claims: what it says, how each sentence is judged, and what came out."""
