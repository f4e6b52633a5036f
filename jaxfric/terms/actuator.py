"""What an amplifier or motor does to the force it was asked for.

Let f be the force that the motion needs. A faulty actuator delivers f when it is told u ≠ f; each
law is u − f to first order in the fault, a function of f. The measured force must not stand in
for f, since it would explain itself: the channel `predicted_force` holds f as the model without
the fault predicts it from the motion, free of the force's noise.
"""

PREDICTED = "predicted_force"
