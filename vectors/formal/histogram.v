// Histogram of 16 bins (thesis 4.2).
//
// A rising edge of HIT[b] adds one to BIN_b. A bin at its largest count stays there (SATURATES = 1) or begins again at zero.
// PIXEL_CLEAR empties all.
//
// Contract: the bins are cleared at power-up. The gate that stops the clock of a full bin closes within a step
// (a_step_later.v): before the next HIT.
module histogram_rtl #(parameter BITS = 14, SATURATES = 1) (
  input [15:0] HIT,
  input PIXEL_CLEAR,
  output [BITS-1:0] BIN_0, BIN_1, BIN_2, BIN_3, BIN_4, BIN_5, BIN_6, BIN_7,
  output [BITS-1:0] BIN_8, BIN_9, BIN_10, BIN_11, BIN_12, BIN_13, BIN_14, BIN_15
);
  localparam [BITS-1:0] LARGEST = -1;
  wire [16*BITS-1:0] counts;
  genvar bin;
  generate
    for (bin = 0; bin < 16; bin = bin + 1) begin : bins
      reg [BITS-1:0] count;
      always @(posedge HIT[bin] or posedge PIXEL_CLEAR)
        if (PIXEL_CLEAR) count <= 0;
        else if (!SATURATES || count != LARGEST) count <= count + 1;
      assign counts[bin*BITS +: BITS] = count;
    end
  endgenerate
  assign {BIN_15, BIN_14, BIN_13, BIN_12, BIN_11, BIN_10, BIN_9, BIN_8} = counts[16*BITS-1:8*BITS];
  assign {BIN_7, BIN_6, BIN_5, BIN_4, BIN_3, BIN_2, BIN_1, BIN_0} = counts[8*BITS-1:0];

  reg is_on = 0;
  always @($global_clock) is_on <= 1;
  always @* if (!is_on) assume (PIXEL_CLEAR);
endmodule
