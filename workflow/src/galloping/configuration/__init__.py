"""What a study is: its settings, their checks, and the reference generated from them."""
