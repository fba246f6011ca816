"""Registration of a camera's JPEG on its RAW: a scale and an offset, and the lens distortion that the camera removed.

The two pictures differ by a tone curve and a colour matrix, so what is compared is their local structure: luma,
gamma-compressed, band-passed, and divided by its local contrast (`local_structure`). `register.register_rotated` is the
whole, and reads as the list of its steps:

1. copies of both pictures that are as small as each step allows (`reduced_copies`);
2. a search over all plausible scales and all offsets, which proposes places (`search`);
3. the choice among them: where the RAW's colours explain the JPEG's best (`colour_prediction`), if no other place does
   nearly as well;
4. refinement below a tenth of a pixel, coarse to fine (`refinement`): the structures compared (`structure_comparison`),
   and the step that brings them closer (`normal_equations`);
5. distortion and lateral chromatic aberration, where they are significant (`lens_correction`).

The RAW is always averaged over exactly a JPEG pixel's area (`area_means`).
"""
