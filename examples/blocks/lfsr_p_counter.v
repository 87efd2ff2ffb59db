// A P-counter that is a shift register with feedback: it counts through 511 of 512 states in an order of its own, without carries.
// Start values are whatever state comes after that many edges; gdtof measures which.
//
//   yosys -p "read_verilog lfsr_p_counter.v; synth -flatten; write_json lfsr_p_counter.json"
module lfsr_p_counter (
    input [8:0] COUNTER_INIT,
    input MEMORY_LOAD,
    input MEMORY_RESET,
    input COUNTER_CLK,
    input COUNTER_RESET,
    output reg LOCAL_STOP
);
    reg [8:0] MEMORY;
    always @(posedge MEMORY_LOAD or posedge MEMORY_RESET)
        if (MEMORY_RESET) MEMORY <= 0;
        else MEMORY <= COUNTER_INIT;

    // x^9 + x^5 + 1 is primitive. With an XNOR the state that stays is all ones, not the zero of the reset.
    reg [8:0] COUNTER_OUT;
    always @(posedge COUNTER_CLK or posedge COUNTER_RESET)
        if (COUNTER_RESET) begin
            COUNTER_OUT <= 0;
            LOCAL_STOP <= 0;
        end else begin
            COUNTER_OUT <= {COUNTER_OUT[7:0], COUNTER_OUT[8] ~^ COUNTER_OUT[4]};
            LOCAL_STOP <= COUNTER_OUT == MEMORY;
        end
endmodule
