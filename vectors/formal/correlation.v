// Correlation block: whether the number of SPADs that fired is less than THRESHOLD (TYPE 0), equal (1) or greater (2 and 3)
// (thesis 4.2, Fig. 47).
//
// Contract: none, it has no state. BITS are those of THRESHOLD and hold SPADS.
module correlation_rtl #(parameter SPADS = 16, BITS = 5) (
  input [SPADS-1:0] SPAD_TIMED,
  input [1:0] TYPE,
  input [BITS-1:0] THRESHOLD,
  output reg SPAD_EVENT
);
  reg [BITS-1:0] COUNT;
  integer spad;
  always @* begin
    COUNT = 0;
    for (spad = 0; spad < SPADS; spad = spad + 1) COUNT = COUNT + SPAD_TIMED[spad];
    case (TYPE)
      0: SPAD_EVENT = COUNT < THRESHOLD;
      1: SPAD_EVENT = COUNT == THRESHOLD;
      default: SPAD_EVENT = COUNT > THRESHOLD;
    endcase
  end
endmodule
