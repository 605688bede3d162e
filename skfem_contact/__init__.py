"""Contact and friction between deformable bodies for scikit-fem."""
