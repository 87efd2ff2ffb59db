// METDC with a shift register (thesis 4.2, 4.3, Fig. 47, 48).
//
// Each rising edge of CLK shifts SPAD_EVENT in; PIXEL_CLEAR empties the register. A rising edge of the strobe copies it into HIT with
// the earliest event in bin 0. In the guided mode LOCAL_STOP is the strobe and COUNTER_RESET clears HIT, in the conventional mode
// STOP_D is, and a low STOP does.
//
// Contract: both registers are cleared at power-up.
module metdc_rtl #(parameter BINS = 16) (
  input CLK, SPAD_EVENT, LOCAL_STOP, STOP, STOP_D, COUNTER_RESET, CONVENTIONAL, PIXEL_CLEAR,
  output reg [BINS-1:0] HIT
);
  wire STROBE = CONVENTIONAL ? STOP_D : LOCAL_STOP;
  wire HIT_RESET = CONVENTIONAL ? !STOP : COUNTER_RESET;

  reg [BINS-1:0] SHIFT;
  always @(posedge CLK or posedge PIXEL_CLEAR)
    if (PIXEL_CLEAR) SHIFT <= 0;
    else SHIFT <= SHIFT << 1 | SPAD_EVENT;

  genvar bin;
  generate
    for (bin = 0; bin < BINS; bin = bin + 1) begin : bins
      always @(posedge STROBE or posedge HIT_RESET)
        if (HIT_RESET) HIT[bin] <= 0;
        else HIT[bin] <= SHIFT[BINS-1-bin];
    end
  endgenerate

  reg is_on = 0;
  always @($global_clock) is_on <= 1;
  always @* if (!is_on) assume (PIXEL_CLEAR && HIT_RESET);
endmodule
