// The inverter of a block whose delay matters even where all else is settled, for a proof that knows steps and no times: it
// follows its input a step later. It ends the load pulse of the P-counter without memory, and stops the clock of a bin that has just
// become full; without a delay the one would never be and the other would be a loop.
module INV_A_STEP_LATER(output reg Z, input A);
  always @($global_clock) Z <= !A;
endmodule
