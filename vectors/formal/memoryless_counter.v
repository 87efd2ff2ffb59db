// The P-counter without a memory: memoryless (thesis 4.4.3).
//
// A rise of MEMORY_LOAD makes LOAD_PULSE, one step long. While it is high the count is COUNTER_INIT, and while MEMORY_RESET is high
// without it, zero. Every other rising edge of COUNTER_CLK takes one off. COUNTER_RESET does nothing. LOCAL_STOP is the count's top
// bit, which with the tap borrow (BORROW = 1) is a bit more than the start value has.
//
// Contract: the counter is reset at power-up, without a load. The delay chain that ends LOAD_PULSE is a step long (a_step_later.v).
module p_counter_rtl #(parameter BITS = 9, BORROW = 0) (
  input [BITS-1:0] COUNTER_INIT,
  input MEMORY_LOAD, MEMORY_RESET, COUNTER_CLK, COUNTER_RESET,
  output LOCAL_STOP
);
  reg was_loading;
  always @($global_clock) was_loading <= MEMORY_LOAD;
  wire LOAD_PULSE = MEMORY_LOAD && !was_loading;
  wire CLEAR = LOAD_PULSE || MEMORY_RESET;
  wire [BITS-1:0] start = LOAD_PULSE ? COUNTER_INIT : 0;

  reg [BITS+BORROW-1:0] count;
  always @(posedge COUNTER_CLK or posedge CLEAR)
    if (CLEAR) count <= start;
    else count <= count - 1;
  assign LOCAL_STOP = count[BITS+BORROW-1];
  wire [BITS-1:0] COUNTER_OUT = count;

  reg is_on = 0;
  always @($global_clock) is_on <= 1;
  always @* if (!is_on) assume (MEMORY_RESET && !MEMORY_LOAD);
endmodule
