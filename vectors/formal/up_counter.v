// The P-counter that counts up and compares: comparator (thesis 4.4.1, Fig. 49a).
//
// MEMORY_LOAD takes the start value. COUNTER_RESET clears count and LOCAL_STOP. After it, every STEP-th rising edge of
// COUNTER_CLK, the first one among them, takes into LOCAL_STOP whether the count is the start value, and adds one to the count.
//
// Contract: both registers are reset at power-up.
module p_counter_rtl #(parameter BITS = 9, STEP = 1) (
  input [BITS-1:0] COUNTER_INIT,
  input MEMORY_LOAD, MEMORY_RESET, COUNTER_CLK, COUNTER_RESET,
  output reg LOCAL_STOP
);
  reg [BITS-1:0] MEMORY;
  always @(posedge MEMORY_LOAD or posedge MEMORY_RESET)
    if (MEMORY_RESET) MEMORY <= 0;
    else MEMORY <= COUNTER_INIT;

  reg [2:0] step; // The last log2(STEP) bits count.
  reg [BITS-1:0] COUNTER_OUT;
  always @(posedge COUNTER_CLK or posedge COUNTER_RESET)
    if (COUNTER_RESET) step <= 0;
    else step <= step - 1;
  always @(posedge COUNTER_CLK or posedge COUNTER_RESET)
    if (COUNTER_RESET) {LOCAL_STOP, COUNTER_OUT} <= 0;
    else if (step % STEP == 0) begin
      LOCAL_STOP <= COUNTER_OUT == MEMORY;
      COUNTER_OUT <= COUNTER_OUT + 1;
    end

  // What nets of these names show, where there is a divider.
  wire STEP_0 = step[0], STEP_1 = step[1], STEP_CLK = step % STEP >= STEP / 2;

  reg is_on = 0;
  always @($global_clock) is_on <= 1;
  always @* if (!is_on) assume (MEMORY_RESET && COUNTER_RESET);
endmodule
