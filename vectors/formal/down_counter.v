// P-counters with a memory that count down, all but comparator: gray with GRAY = 1 (thesis 4.4, Fig. 50a, 51, 53).
//
// MEMORY_LOAD takes the start value. While COUNTER_RESET is high the count is the start value. After it, every STEP-th rising
// edge of COUNTER_CLK, the first one among them, takes one off. LOCAL_STOP is the count's top bit. With the tap borrow
// (BORROW = 1) that is a bit more than the start value has, which rises when the count rolls over past zero.
//
// Contract: both registers are reset at power-up. The memory changes only while COUNTER_RESET is high: a multiplexer that it flips
// is an edge for the next stage.
module p_counter_rtl #(parameter BITS = 9, BORROW = 1, GRAY = 0, STEP = 1) (
  input [BITS-1:0] COUNTER_INIT,
  input MEMORY_LOAD, MEMORY_RESET, COUNTER_CLK, COUNTER_RESET,
  output LOCAL_STOP
);
  reg [BITS-1:0] MEMORY;
  always @(posedge MEMORY_LOAD or posedge MEMORY_RESET)
    if (MEMORY_RESET) MEMORY <= 0;
    else MEMORY <= COUNTER_INIT;

  reg [2:0] step; // The last log2(STEP) bits count.
  reg [BITS+BORROW-1:0] count;
  always @(posedge COUNTER_CLK or posedge COUNTER_RESET)
    if (COUNTER_RESET) step <= 0;
    else step <= step - 1;
  always @(posedge COUNTER_CLK or posedge COUNTER_RESET)
    if (COUNTER_RESET) count <= MEMORY;
    else if (step % STEP == 0) count <= count - 1;
  assign LOCAL_STOP = count[BITS+BORROW-1];

  // What nets of these names show, in variants that have them.
  wire [BITS-1:0] COUNTER_OUT = GRAY ? count ^ count >> 1 : count;
  wire GRAY_PARITY = count[0];
  wire STEP_0 = step[0], STEP_1 = step[1], STEP_CLK = step % STEP >= STEP / 2;

  reg is_on = 0;
  always @($global_clock) is_on <= 1;
  always @* begin
    if (!is_on) assume (MEMORY_RESET && COUNTER_RESET);
    if (MEMORY_RESET || MEMORY_LOAD) assume (COUNTER_RESET);
  end
endmodule
